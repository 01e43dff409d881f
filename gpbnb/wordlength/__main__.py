"""``python -m gpbnb.wordlength model.toml --tolerance 0.01``: the wordlength of your own filter, with a report."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence

from gpbnb.files import replace_file
from gpbnb.interrupts import interruptible
from gpbnb.wordlength.options import printable, read
from gpbnb.wordlength.own_code import where_raised

_MISUSE = (ValueError, TypeError, OSError, ArithmeticError, ImportError)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    return interruptible("python -m gpbnb.wordlength", lambda: _run(arguments))


def _run(arguments: Sequence[str] | None) -> int:
    program = "python -m gpbnb.wordlength"
    command = printable(shlex.join([*program.split(), *map(str, sys.argv[1:] if arguments is None else arguments)]))
    try:
        given = read(arguments)
        # These imports take a second, and help and refusals need none of them.
        from gpbnb.wordlength.answer import format_in_words
        from gpbnb.wordlength.report import study
        from gpbnb.wordlength.running import certificate, read_files, uncovered, write, write_code_of, write_run

        asked = read_files(given)
        tell = (lambda text: None) if given.quiet else (lambda text: print(text, file=sys.stderr, flush=True))
        report = study(asked, command, tell)
        proof = certificate(asked, report) if given.certificate else None
    except Exception as error:
        own = where_raised(error)
        if not own and not isinstance(error, _MISUSE):
            raise
        print(f"{program}: {own or error}", file=sys.stderr)
        return 2
    for text in filter(None, (report.entries["text"], report.entries["shortest"])):
        print(text, flush=True)
    try:
        option = f"--report {given.report}"
        if given.report:
            write(report, given.report)
        option = f"--certificate {given.certificate}"
        if proof is not None:
            replace_file(given.certificate, proof.certificate().encode())
            print(f"certificate: {given.certificate}, for {format_in_words(proof.format)}", flush=True)
        option = f"--csv {given.csv}"
        if given.csv and report.answer.met:
            write_run(asked, report, given.csv)
        option = f"--code {given.code}"
        if given.code and report.answer.met:
            files, fmt = write_code_of(given.code, asked, report)
            print("code:", *files)
            if proof is not None and (other := uncovered(proof.format, fmt)):
                print(other)
        elif given.code:
            print(f"{program}: no code, since no format is known to meet the tolerance", file=sys.stderr)
    except (ValueError, ArithmeticError) as error:
        print(f"{program}: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{program}: got {option}, which could not be written: {error}", file=sys.stderr)
        return 2
    return 0 if report.answer.met else 1


if __name__ == "__main__":
    sys.exit(main())
