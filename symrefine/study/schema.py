"""What a study's config may say."""

from dataclasses import dataclass, field

from symrefine.study.document import Node
from symrefine.study.summary import Expectation, Measure
from symrefine.study.typed import Scalar

NOTHING = Node(value={}, place="", path="")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A Markdown table: the runs that `where` picks, one line for each combination of `groups`."""

    node: Node
    title: str
    groups: list[str]
    values: dict[str, Measure]
    where: Node = NOTHING


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A picture: y over x, one line or colour for each value of `by`."""

    node: Node
    title: str
    kind: str
    y: Measure
    x: str = "iteration"
    by: str = ""
    where: Node = NOTHING
    log: bool = False
    x_label: str = ""
    y_label: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A figure of the paper beside ours and those of others; `expect` says when ours holds."""

    node: Node
    claim: str
    source: str
    paper: Scalar
    value: Measure
    ours: Node
    where: Node = NOTHING
    peers: dict[str, Node] = field(default_factory=dict)
    expect: Expectation = field(default_factory=Expectation)
    unit: str = ""
    main: bool = False
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """A config: the experiment, where its rows go, its cases, and what is made of the rows."""

    node: Node
    experiment: str
    out: str
    title: str = ""
    fixed: Node = NOTHING
    sweep: Node = NOTHING
    quick: dict[str, Node] = field(default_factory=dict)
    tables: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    record: list[Node] = field(default_factory=list)
    claims: list[Claim] = field(default_factory=list)
