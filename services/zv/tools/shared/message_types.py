"""The types of messages: those of this project by their classes, others by their nodes' schemas.

A node answers ``@{ns}/schema/{name}`` with the JSON Schema of each message that it sends. A schema
may be hostile: it is checked against limits before it is used, and one that cannot be used becomes
an error text, never an unexpected exception.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

from zenoh_vision import keys
from zenoh_vision.error_text import did_you_mean, joined, printable, similar_names
from zenoh_vision.errors import ConfigurationError, PayloadError
from zenoh_vision.message_codec import Message
from zenoh_vision.messages import MESSAGES, Header, NodeDescription, known_message
from zenoh_vision.topics import topic_of
from zenoh_vision.transport.query import Query, Reply, messages_in
from zv.tools.shared.discovery import MAX_COMPARED, discover
from zv.tools.shared.json_schema import Schema, UnusableSchema, parsed, resolved
from zv.tools.shared.session import ToolSession

if TYPE_CHECKING:
    from zv.tools.shared.schema_check import SchemaCheck

MAX_REPLIES_BYTES = 8 << 20
MAX_TYPES = 200
"""Most schemas of other messages that are kept."""

MAX_TEXTS = 2
"""Most different schemas of one name that are kept: two are already the problem."""

PICTURES = "/compressed"

MAX_COLUMNS = 200
MAX_COLUMN_DEPTH = 4

HEADER_FIELDS = {"camera", "epoch", "seq", "stamp_ns"}


@dataclass(frozen=True)
class MessageType:
    """The fields of a message, and what is allowed in them.

    Attributes:
        schema_name: The versioned name in the Zenoh encoding: ``my.Brightness.v1``.
        schema: Its JSON Schema.
        checked: Returns the map to send for a map of fields; raises ``PayloadError`` if it is not
            of this type, or the schema cannot be used.
    """

    schema_name: str
    schema: Schema = field(repr=False)
    checked: Callable[[dict[str, Any]], dict[str, Any]] = field(repr=False)

    @property
    def short_name(self) -> str:
        """``Brightness`` where the versioned name is ``my.Brightness.v1``."""
        return keys.short_name_of(self.schema_name)

    @property
    def fields(self) -> tuple[str, ...]:
        """The names of its fields."""
        return tuple(self.schema["properties"])

    @property
    def meaning(self) -> str:
        """The first line of its description; empty if it has none."""
        text = self.schema.get("description")
        return text.partition("\n")[0][:200] if isinstance(text, str) else ""

    @cached_property
    def stamped(self) -> bool:
        """Whether it belongs to a frame: its field ``header`` identifies one."""
        header = resolved(self.schema, self.schema["properties"].get("header"))
        properties = header.get("properties")
        return isinstance(properties, dict) and properties.keys() >= HEADER_FIELDS

    def columns(self, *, header: bool) -> list[str]:
        """Return the names of its fields for a table; those of maps in it are dotted."""
        found: list[str] = []
        for name, part in self.schema["properties"].items():
            if name != "header" or not self.stamped:
                found += _columns(self.schema, name, part, MAX_COLUMN_DEPTH)
            elif header:
                found += [f"header.{each}" for each in Header.model_fields]
        return found[:MAX_COLUMNS]


def _columns(document: Schema, name: str, part: object, depth: int) -> list[str]:
    """Return the columns of a field: one, or those of the fields of a map, which may be nil."""
    found = resolved(document, part)
    either = found.get("anyOf")
    present = (
        [each for each in either if each != {"type": "null"}] if isinstance(either, list) else []
    )
    if len(present) == 1:
        found = resolved(document, present[0])
    properties = found.get("properties")
    if not isinstance(properties, dict) or not properties or depth == 0:
        return [name]
    columns: list[str] = []
    for inner, each in properties.items():
        if len(columns) < MAX_COLUMNS:
            columns += _columns(document, f"{name}.{inner}", each, depth - 1)
    return columns


def known_type(message: type[Message]) -> MessageType:
    """Return the type of a message of this project."""

    def checked(fields: dict[str, Any]) -> dict[str, Any]:
        return message.from_map(fields).to_map()

    return MessageType(message.schema_name, message.model_json_schema(), checked)


def foreign_type(schema_name: str, text: bytes) -> MessageType:
    """Return the type of a message whose schema a node has answered.

    Raises:
        UnusableSchema: The text is too large, or is not the schema of an object.
    """
    schema = parsed(text)

    @cache
    def check() -> SchemaCheck:
        from zv.tools.shared.schema_check import SchemaCheck  # loads for 0.1 s

        return SchemaCheck(schema)

    def checked(fields: dict[str, Any]) -> dict[str, Any]:
        try:
            error = check().error_in(fields, keys.short_name_of(schema_name))
        except UnusableSchema as unsuited:
            error = unusable(schema_name, unsuited)
        if error:
            raise PayloadError("bad_message", printable(error))
        return fields

    return MessageType(schema_name, schema, checked)


@dataclass(frozen=True, slots=True)
class Answers:
    """The nodes' answers about messages that are not of this project.

    Attributes:
        types: By versioned name.
        problems: Why a name has no type, by versioned name: its schema cannot be used, or several
            nodes answer different ones.
        sessions: Ids of the sessions that answered, by versioned name.
    """

    types: Mapping[str, MessageType]
    problems: Mapping[str, str]
    sessions: Mapping[str, frozenset[str]]


def foreign_types(session: ToolSession) -> Answers:
    """Query the nodes for the schemas of their own messages."""
    query = Query(keys.schema_key(session.namespace, "*"), most_bytes=MAX_REPLIES_BYTES)
    return answers_of(session.ask_all(query)[0])


def answers_of(replies: Iterable[Reply]) -> Answers:
    """Return the types that replies to a query for schemas describe."""
    found: dict[str, dict[bytes, MessageType]] = {}
    problems: dict[str, str] = {}
    sessions: dict[str, set[str]] = {}
    for reply in replies:
        # Each schema is answered under its short name too, which alone is ambiguous.
        if reply.ok is None or "." not in reply.name or reply.name in MESSAGES:
            continue
        name = reply.name
        if not keys.SCHEMA_NAME.fullmatch(name) or (name not in found and len(found) == MAX_TYPES):
            continue
        sessions.setdefault(name, set()).add(reply.session)
        of_name = found.setdefault(name, {})
        if len(of_name) == MAX_TEXTS:
            continue
        text = reply.ok.payload.to_bytes()
        try:
            of_name.setdefault(text, foreign_type(name, text))
        except UnusableSchema as error:
            problems[name] = unusable(name, error)
    types = {}
    for name, by_text in found.items():
        if len(by_text) > 1:
            problems[name] = f"{len(by_text)} different schemas of {name} are answered by nodes"
        elif by_text:
            (types[name],) = by_text.values()
            problems.pop(name, None)
    return Answers(types, problems, {name: frozenset(ids) for name, ids in sessions.items()})


def unusable(name: str, error: UnusableSchema) -> str:
    """Return the error text for a schema that cannot be used."""
    return f"the schema of {name} cannot be used: {printable(str(error))}"


def own_keys(session: ToolSession) -> list[str]:
    """Return the published keys of messages that are not in the topic table, sorted.

    Keys of pictures are left out, since those may be produced only on demand.
    """
    published = discover(session).keys(f"{session.namespace}/**")
    return sorted(k for k in published if topic_of(k) is None and not k.endswith(PICTURES))


def keys_by_schema(session: ToolSession) -> dict[str, list[str]]:
    """Return published keys that are not in the topic table, by the type of their newest sample."""
    own = own_keys(session)[:MAX_TYPES]
    queries = [Query(key, most_bytes=MAX_REPLIES_BYTES) for key in own]
    found: dict[str, list[str]] = {}
    for key, replies in zip(own, session.ask_all(*queries), strict=True):
        for name in sorted(_schema_names(replies)):
            found.setdefault(name, []).append(key)
    return found


def type_on(session: ToolSession, key: str) -> MessageType | None:
    """Return the type of the messages on a key, by the newest one, else by the publishing nodes.

    None if it is unknown.

    Raises:
        ConfigurationError: It is ambiguous, or its schema cannot be used.
    """
    names = _schema_names(session.ask(key))
    if len(names) > 1:
        raise ConfigurationError(
            f"{key} carries messages of several types: {', '.join(sorted(names))}; "
            "name one with --type"
        )
    if names:
        return type_named(names.pop(), lambda: foreign_types(session))
    described = session.ask(keys.node_key(session.namespace, "*"))
    publishing = {
        reply.session
        for reply, node in messages_in(described, NodeDescription)
        if key in node.publishes
    }
    answers = foreign_types(session)
    possible = [name for name, sessions in answers.sessions.items() if sessions & publishing]
    if len(possible) > 1:
        raise ConfigurationError(
            f"nothing was sent on {key} yet, and who publishes there sends {joined(possible)}; "
            "name one with --type"
        )
    return type_named(possible[0], lambda: answers) if possible else None


def _schema_names(replies: Iterable[Reply]) -> set[str]:
    """Return the schema names in the encodings of samples."""
    found = {keys.schema_name_of(str(reply.ok.encoding)) for reply in replies if reply.ok}
    return {name for name in found if keys.SCHEMA_NAME.fullmatch(name)}


def type_named(name: str, answers: Callable[[], Answers]) -> MessageType:
    """Return the type of a short or versioned name, in any case.

    Args:
        name: Name of a message of this project, or of a running node's.
        answers: Returns the nodes' answers; called only for names of other programs.

    Raises:
        ConfigurationError: There is none, it is ambiguous, or its schema cannot be used.
    """
    message = known_message(name)
    if message is not None:
        return known_type(message)
    found = answers()
    wanted = name.lower()
    names = [
        each
        for each in (*found.types, *found.problems)
        if wanted in (each.lower(), keys.short_name_of(each).lower())
    ]
    if len(names) > 1:
        raise ConfigurationError(f"{name!r} names several messages: {', '.join(names)}; give one")
    if names:
        if names[0] in found.problems:
            raise ConfigurationError(found.problems[names[0]])
        return found.types[names[0]]
    known = sorted(message.short_name() for message in MESSAGES.values())
    others = sorted(found.types)
    compared = [*known, *others, *map(keys.short_name_of, others)]
    hint = did_you_mean(similar_names(name[:MAX_COMPARED], compared), after=" ")
    running = f", and of running nodes {joined(others)}" if others else ""
    raise ConfigurationError(f"no message {name!r}: {hint}there are {', '.join(known)}{running}")
