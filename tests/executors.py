"""Executors for the tests of long computations."""

from concurrent.futures import Executor, Future


class Failing(Executor):
    """Fails with given exceptions first, then works."""

    def __init__(self, *errors):
        self.errors, self.sent = list(errors), 0

    def submit(self, function, /, *arguments):
        self.sent += 1
        future = Future()
        if self.errors:
            future.set_exception(self.errors.pop(0))
        else:
            future.set_result(function(*arguments))
        return future
