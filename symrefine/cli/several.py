"""Several objects in one go: a line for each as soon as it is done, an array of records; one that fails ends no other.

A command says how it makes the record of an object, and how that reads on a line.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from symrefine.cli.inputs import Object, failure
from symrefine.cli.outputs import STDOUT, complain, is_quiet, print_lines, say, write_all
from symrefine.cli.signs import Doing
from symrefine.errors import InputError
from symrefine.files import json_array_text, text_writer

Record = dict[str, Any]
# Exit status of `--strict` where nothing is decided, and where one of several objects could not be used.
UNDETERMINED, REFUSED = 3, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Many:
    """What a command does with each of several objects.

    Attributes:
        json_to: where the array goes: a file, "-" for stdout, or None.
        head: of the lines.
        line: the line of an object, from its name and its record.
        record: the record of an object.
        beside: what a record begins with, also where an object fails.
    """

    json_to: str | None
    head: str
    line: Callable[[str, Record], str]
    record: Callable[[Object], Record]
    beside: Callable[[Object], Record] = field(default=lambda given: {"source": given.name})

    def told(self, given: Iterable[Object], doing: Doing) -> Iterator[Record]:
        """The record of each object, a line as soon as it is done."""
        in_lines = self.json_to != STDOUT and not is_quiet()
        if in_lines:
            print_lines([self.head])
        for one in given:
            if not one.frame:
                doing.expect(one.frames - 1)
            record = self._record_or_error(one)
            if in_lines:
                print_lines([self.line(one.name, {"error": None} | record)])
            elif "error" in record:
                complain(record["error"])
            doing.advance()
            yield record

    def end(self, records: Sequence[Record], *, undetermined: bool) -> int:
        """Write the records, and tell whether all went well; `undetermined` is what to say of those that did."""
        text = json_array_text(records)
        if self.json_to == STDOUT:
            say(text)
        elif self.json_to is not None:
            write_all({self.json_to: text_writer(text)})
            print_lines([f"wrote {self.json_to}"])
        if any("error" in record for record in records):
            return REFUSED
        return UNDETERMINED if undetermined else 0

    def _record_or_error(self, given: Object) -> Record:
        """The record of an object, or what was wrong with it."""
        try:
            return self.record(given)
        except Exception as error:  # noqa: BLE001 - one object must not end the others
            return self.beside(given) | {"error": failure(given.name, error)}


def check_alone(outputs: Mapping[str, str | None], there: str, remedy: str) -> None:
    """Refuse outputs, option to file, that are of one object.

    Raises:
        InputError: one of them is given.
    """
    for option, name in outputs.items():
        if name is not None:
            raise InputError(f"{option} {name}: is for one object, and {there}; {remedy}")
