"""What is said when an input or a model does not allow an answer: one form for every door."""

from dataclasses import dataclass, replace


@dataclass(frozen=True, kw_only=True)
class Problem:
    """One thing wrong with an input: where it stands, what it is, the rule it breaks and the cure."""

    key: str  # 'tank "LOX" frequency'
    value: str  # as the user wrote it
    rule: str  # 'must be > 0 rad/s'
    cure: str = ""
    file: str = ""
    line: int | None = None

    def at(self, file: str, line: int | None) -> "Problem":
        """Return the same problem with its place in a file."""
        return replace(self, file=file, line=line)

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}: " if self.line else f"{self.file}: " if self.file else ""
        value = f": {self.value}" if self.value else ""
        cure = f" Cure: {self.cure}{'' if self.cure.endswith('?') else '.'}" if self.cure else ""
        return f"{place}{self.key}{value}; {self.rule}.{cure}"


class InputError(ValueError):
    """The input was refused; `problems` holds every fault found, in file order."""

    def __init__(self, *problems: Problem) -> None:
        self.problems = problems
        super().__init__("\n".join(str(p) for p in problems))


class OutsideValidity(ValueError):
    """A number was asked for that the model or the data does not support; the text says why."""


class NoAttractor(OutsideValidity):
    """Slosh grows from small amplitude, and no limit cycle that attracts is found within the damping data."""
