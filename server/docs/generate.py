"""Generates `PROTOCOL.md` and the web client's types: `python -m server.docs.generate [--check]`.

Fields, sizes and words come from `wire*.py`, `messages.py` and the routes themselves; what a field
may be is what the decoder says when it refuses one.
"""

from __future__ import annotations

import ast
import inspect
import re
import struct
import sys
import types
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Literal, Union, get_args, get_origin, get_type_hints

import msgspec

from hardware.link import blink_datagram, datagram, health_datagram, tool_datagram
from server.common import runtime_parameters
from server.common.options import Parser
from server.docs.protocol_text import RECORDS, page
from server.protocol import (
    calibration_messages,
    camera_messages,
    lead_messages,
    link_messages,
    messages,
    people_messages,
    screen_messages,
    sight_messages,
    wire,
    wire_records,
)
from server.protocol.video_path_messages import PathChoice
from server.protocol.wire import Kind, WireError
from server.protocol.wire_records import Codec, Record

ROOT = Path(__file__).resolve().parents[2]
TYPES = {"B": "u8", "H": "u16", "h": "i16", "I": "u32", "q": "i64", "Q": "u64", "f": "f32"}
STRUCTS: tuple[type[msgspec.Struct], ...] = (
    messages.Hello,
    messages.Command,
    runtime_parameters.Tune,
    lead_messages.Lead,
    lead_messages.UseTool,
    PathChoice,
    calibration_messages.Calibrate,
    messages.Log,
    messages.Welcome,
    messages.Refused,
    calibration_messages.Calibration,
    messages.Stream,
    messages.GapCount,
    messages.LoggedEvent,
    runtime_parameters.RuntimeParameters,
    messages.VirtualCameraStatus,
    messages.Estimate,
    lead_messages.LeadingStatus,
    lead_messages.ToolStatus,
    camera_messages.CameraHealth,
    people_messages.Person,
    messages.EpisodeStatus,
    messages.Status,
    people_messages.Deed,
    link_messages.LinkReport,
    screen_messages.ScreenSize,
    screen_messages.ClockAsk,
    screen_messages.ClockAnswer,
    screen_messages.ScreenLights,
    sight_messages.Sight,
)
UNIONS = {"FromPage": messages.FromPage, "ToPage": messages.ToPage}
HEADER_FIELDS = (
    ("magic", 1, f"{wire.MAGIC:#x}"),
    ("version", 1, str(wire.VERSION)),
    ("kind", 1, "see below"),
    ("flags", 1, "see below; 0 where nothing is said"),
    ("sequence", 1, "counts the records of one kind on one connection"),
    ("time", 1, "[µs] of the sender's own clock; of a reading or picture: when it was taken"),
)

MOTION = wire_records.Motion((0.0, 0.0, 0.0), (0.0, 0.0, 9.8), (1.0, 0.0, 0.0, 0.0), 0)
PICTURE = wire_records.Picture(Codec.JPEG, True, 1280, 720, 0, b"\xff\xd8")
TOUCH = wire_records.Touch(False, True, 0, 1)
BROKEN: tuple[wire_records.Body, ...] = (
    replace(MOTION, rotation_rate=(1e9, 0.0, 0.0)),
    replace(MOTION, acceleration=(1e9, 0.0, 0.0)),
    replace(MOTION, orientation_wxyz=(0.1, 0.0, 0.0, 0.0)),
    replace(MOTION, screen_angle_deg=45),
    replace(PICTURE, codec=0),  # type: ignore[arg-type]
    replace(PICTURE, width=1),
    replace(PICTURE, shrunk=3),
    replace(PICTURE, data=b"GIF"),
    replace(PICTURE, screen_angle_deg=45),
    replace(TOUCH, held=2),  # type: ignore[arg-type]
)


@cache
def limits() -> dict[str, str]:
    """What is allowed, by the name of the field, as the decoder itself says."""
    said: dict[str, str] = {}
    for body in BROKEN:
        try:
            wire.decode(wire.encode(Record(0, 0, body)))
        except WireError as error:
            said |= dict.fromkeys(error.field.split(", "), error.allowed)
        else:
            raise AssertionError(f"taken, but should not be: {body}")
    size = said.pop("frame.size")
    return said | {"frame.width": size, "frame.height": size}


@cache
def docs(module: types.ModuleType) -> dict[str, str]:
    """Words below each field, by class and field with a dot between."""
    found: dict[str, str] = {}
    body = ast.parse(inspect.getsource(module)).body
    for node in (one for one in body if isinstance(one, ast.ClassDef)):
        for field, words in zip(node.body, node.body[1:], strict=False):
            if isinstance(field, ast.AnnAssign) and isinstance(words, ast.Expr):
                text = ast.literal_eval(words.value)
                found[f"{node.name}.{ast.unparse(field.target)}"] = " ".join(text.split())
    return found


def byte_rows(
    layout: struct.Struct, fields: Sequence[tuple[str, int, str]], start: int
) -> Iterator[str]:
    """Table rows of a layout: offset, type, field, words.

    Raises:
        ValueError: the fields are not those of the layout.
    """
    chars = "".join(c * int(n or 1) for n, c in re.findall(r"(\d*)([a-zA-Z])", layout.format))
    if len(chars) != sum(count for _, count, _ in fields):
        raise ValueError(f"{layout.format}: {fields}")
    at, offset = 0, start
    for name, count, words in fields:
        (char,) = set(chars[at : at + count])
        kind = f"{count} × {TYPES[char]}" if count > 1 else TYPES[char]
        yield f"| {offset} | {kind} | {name} | {words} |"
        at, offset = at + count, offset + count * struct.calcsize(f"<{char}")


def _record(kind: Kind) -> list[str]:
    body, layout, names = RECORDS[kind]
    title, _, words = (body.__doc__ or "").partition(": ")
    sender = "page → server" if kind < 128 else "server → page"
    lines = [f"### {title} ({int(kind)}), {sender}", "", words[:1].upper() + words[1:], ""]
    for field in body.__dataclass_fields__:
        if "flag bit" in (doc := docs(wire_records).get(f"{body.__name__}.{field}", "")):
            lines += [f"Flags: `{field}`. {doc}", ""]
    lines += ["| offset | type | field | |", "|---|---|---|---|"]
    fields = [(f"`{n}`" if n else "zero", count, _about(title, body, n)) for n, count in names]
    if layout is not None:
        lines += byte_rows(layout, fields, wire.HEADER.size)
    if "data" in body.__dataclass_fields__:
        offset = wire.HEADER.size + (layout.size if layout else 0)
        lines.append(f"| {offset} | bytes | `data` | {_about(title, body, 'data')} |")
    return [*lines, ""]


def _about(title: str, body: type, name: str) -> str:
    allowed = limits().get(f"{title.lower()}.{name}", "")
    words = docs(wire_records).get(f"{body.__name__}.{name}", "")
    return " ".join(filter(None, (words, f"Allowed: {allowed}." if allowed not in words else "")))


def records() -> str:
    """Header and payload of every record."""
    lines = ["| offset | type | field | |", "|---|---|---|---|"]
    lines += [*byte_rows(wire.HEADER, HEADER_FIELDS, 0), ""]
    for kind in Kind:
        lines += _record(kind)
    return "\n".join(lines).rstrip()


def js_type(hint: object) -> str:
    """The JavaScript (and JSON) type of a Python annotation."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hasattr(hint, "__metadata__"):
        return js_type(arguments[0])
    if origin is Literal:
        return " | ".join(f"'{value}'" for value in arguments)
    if origin in (Union, types.UnionType):
        return " | ".join(map(js_type, arguments))
    if origin is list:
        inner = js_type(arguments[0])
        return f"({inner})[]" if "|" in inner else f"{inner}[]"
    if origin is dict:
        return f"Record<string, {js_type(arguments[1])}>"
    plain: dict[object, str] = {
        str: "string",
        bool: "boolean",
        int: "number",
        float: "number",
        type(None): "null",
    }
    return plain.get(hint) or str(getattr(hint, "__name__", hint))


def _limit(hint: object) -> str:
    """What `Meta` allows beyond the type."""
    metas = getattr(hint, "__metadata__", ())
    if get_origin(hint) in (Union, types.UnionType):
        return "".join(map(_limit, get_args(hint)))
    words = [f"at most {m.max_length} characters" for m in metas if m.max_length is not None]
    return "".join([*words, *(f"{m.ge} to {m.le}" for m in metas if m.ge is not None)])


def _fields(struct_: type[msgspec.Struct]) -> Iterator[tuple[str, object, str]]:
    """(name, annotation, words) of each field, as a page reads them."""
    hints = get_type_hints(struct_, include_extras=True)
    for name in struct_.__struct_fields__:
        words = docs(sys.modules[struct_.__module__]).get(f"{struct_.__name__}.{name}", "")
        yield name, hints[name], re.sub(r"\bNone\b", "null", words)


def _summary(struct_: type[msgspec.Struct]) -> str:
    return " ".join(inspect.cleandoc(struct_.__doc__ or "").split())


def message_tables() -> str:
    """Fields of every message."""
    lines: list[str] = []
    for struct_ in STRUCTS:
        tag = struct_.__struct_config__.tag
        lines += [f'### `"type": "{tag}"`' if tag else f"### {struct_.__name__}", ""]
        lines += [_summary(struct_), "", "| field | type | |", "|---|---|---|"]
        required = {f.name for f in msgspec.structs.fields(struct_) if f.required}
        for name, hint, words in _fields(struct_):
            notes = [words, f"Allowed: {_limit(hint)}." if _limit(hint) else ""]
            notes.append("" if name in required else "May be left out.")
            kind = js_type(hint).replace("|", "\\|")
            lines.append(f"| `{name}` | `{kind}` | {' '.join(filter(None, notes))} |")
        lines.append("")
    return "\n".join(lines).rstrip()


def links() -> str:
    """Datagrams of the robot's own link, as their modules tell them."""
    modules = datagram, blink_datagram, health_datagram, tool_datagram
    told = (inspect.cleandoc(module.__doc__ or "") for module in modules)
    return "\n\n".join(told)


def javascript() -> str:
    """`web_client/src/wire/protocol_types.js`."""
    head = "The JSON messages between the pages and the server."
    lines = ["/**", f" * {head}", " * Generated by `python -m server.docs.generate`.", " */", ""]
    for struct_ in STRUCTS:
        tag = struct_.__struct_config__.tag
        lines += ["/**", f" * {_summary(struct_)}", f" * @typedef {{object}} {struct_.__name__}"]
        lines += [f" * @property {{'{tag}'}} type"] if tag else []
        for name, hint, words in _fields(struct_):
            lines.append(f" * @property {{{js_type(hint)}}} {name} {words}".rstrip())
        lines += [" */", ""]
    for name, union in UNIONS.items():
        lines.append(f"/** @typedef {{{js_type(union)}}} {name} */")
    return "\n".join([*lines, "", "export {};", ""])


def outputs() -> dict[Path, str]:
    """Every generated file."""
    return {
        ROOT / "PROTOCOL.md": page(records(), message_tables(), links()),
        ROOT / "web_client/src/wire/protocol_types.js": javascript(),
    }


def main(argv: Sequence[str] | None = None) -> int:
    """Write them; with `--check` only tell which are out of step."""
    parser = Parser(prog="python -m server.docs.generate", description=__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing, fail if out of step")
    check = bool(parser.parse_args(argv).check)
    stale = False
    for path, text in outputs().items():
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        stale = True
        print(f"{path.relative_to(ROOT)}: {'out of step' if check else 'written'}")
        if not check:
            path.write_text(text, encoding="utf-8")
    return int(check and stale)


if __name__ == "__main__":
    sys.exit(main())
