"""Copies of an array with some entries replaced, because the entries of an array cannot be assigned."""

from __future__ import annotations

from typing import Any, NamedTuple


class At:
    """What ``x.at`` returns; ``x.at[index]`` selects the entries to be replaced in a copy."""

    def __init__(self, array: Any) -> None:
        self.array = array

    def __getitem__(self, index: Any) -> Entries:
        return Entries(self.array, index)


class Entries(NamedTuple):
    """Some entries of an array, selected by any index that NumPy takes.

    Each method returns a copy of the whole array. Values broadcast to the entries, and are numbers of the format. An
    entry that the index names twice takes its last value, as in NumPy's ``x[index] += value``.
    """

    array: Any
    where: Any

    def get(self) -> Any:
        """Return the entries."""
        return self.array[self.where]

    def set(self, value: Any) -> Any:
        """Return a copy with these values in place of the entries; nothing is rounded.

        Raises
        ------
        IndexError : an index beyond an axis.
        ValueError : values that do not broadcast to the entries, or that the format does not hold exactly.
        """
        array, index = self.array, self.where

        def assigned(parts: Any) -> Any:
            whole = parts[0].copy()
            whole[index] = parts[1][()]  # for a single number, the number itself
            return whole

        return array.joined(assigned, [array, array.operand(value)])

    def add(self, value: Any) -> Any:
        """Return a copy with ``x[index] + value`` in place of the entries."""
        return self.set(self.get() + value)

    def subtract(self, value: Any) -> Any:
        """Return a copy with ``x[index] - value`` in place of the entries."""
        return self.set(self.get() - value)

    def multiply(self, value: Any) -> Any:
        """Return a copy with ``x[index] * value`` in place of the entries."""
        return self.set(self.get() * value)

    def divide(self, value: Any) -> Any:
        """Return a copy with ``x[index] / value`` in place of the entries."""
        return self.set(self.get() / value)
