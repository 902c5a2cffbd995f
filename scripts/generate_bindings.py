#!/usr/bin/env python3
"""Writes what the bindings repeat of the C headers: the ctypes mirror of Python, the init() overloads of C++.

scripts/generate_bindings.py           writes both files
scripts/generate_bindings.py --check   fails if one of them is not what the headers say
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HEADERS = ROOT / "capi" / "include" / "clspeckle"
PYTHON = ROOT / "bindings" / "python" / "src" / "clspeckle" / "_generated.py"
CPP = ROOT / "bindings" / "cpp" / "include" / "clspeckle" / "init.hpp"
WIDTH = 120

SCALARS = {
    "int32_t": "i32",
    "uint8_t": "u8",
    "uint16_t": "u16",
    "uint32_t": "u32",
    "uint64_t": "u64",
    "double": "f64",
    "float": "f32",
    "char": "char",
    "ClspStatus": "i32",
}


class Headers:
    """What the headers declare, in the order in which clspeckle.h includes them."""

    def __init__(self, folder: Path = HEADERS) -> None:
        self.text = _read(folder, "clspeckle.h", set())
        numbers = re.findall(r"#define (CLSP_\w+) \(?(-?(?:0x)?[0-9A-Fa-f]+)u?\)?", self.text)
        self.constants = {name: value for name, value in numbers if not re.match(r"CLSP_(ERROR|VERSION|ABI)_", name)}
        self.abi = dict(numbers)["CLSP_ABI_VERSION"]
        self.version = ".".join(dict(numbers)[f"CLSP_VERSION_{part}"] for part in ("MAJOR", "MINOR", "PATCH"))
        self.handles = {"cl_context", "cl_device_id", "cl_command_queue", "cl_mem", "cl_event", "cl_platform_id"}
        self.handles |= set(re.findall(r"typedef struct Clsp\w+_ \*(Clsp\w+);", self.text))
        self.structs = {
            name: [" ".join(member.split()) for member in body.split(";") if member.strip()]
            for name, body in re.findall(r"typedef struct (Clsp\w+) \{(.*?)\}", self.text, flags=re.S)
        }
        callbacks = re.findall(r"typedef (\w+) \(\*(Clsp\w+)\)\(([^)]*)\);", self.text)
        self.callbacks = {name: (result, _parameters(arguments)) for result, name, arguments in callbacks}
        functions = re.findall(r"CLSP_API\s+([\w\s*]+?)\s*(clsp\w+)\(([^)]*)\);", self.text)
        self.functions = {name: (result, _parameters(arguments)) for result, name, arguments in functions}

    def kind(self, declaration: str, *, member: bool = False) -> str:
        """The ctypes type of a parameter or member, by the short names of the generated file."""
        base = declaration.replace("const ", "").replace("*", " ").split()[0]
        pointers = declaration.count("*")
        size = re.search(r"\[(\w+)\]", declaration)
        if size and not member:
            pointers += 1
        if base in self.callbacks:
            result = _callback_name(base)
        elif base in self.structs:
            result = base
        elif base in self.handles:
            result = "_void"
        elif base == "void":
            result, pointers = "_void", pointers - 1
        elif base == "char" and declaration.startswith("const "):
            result, pointers = "_text", pointers - 1
        elif base in SCALARS:
            result = f"_{SCALARS[base]}"
        else:
            raise ValueError(f"{declaration}: the type {base} is not known here")
        for _ in range(pointers):
            result = f"_P({result})"
        return f"{result} * {self.constants.get(size[1], size[1])}" if size and member else result


def _read(folder: Path, name: str, seen: set[str]) -> str:
    """A header without its comments, after those that it includes."""
    if name in seen:
        return ""
    seen.add(name)
    text = re.sub(r"/\*.*?\*/|//[^\n]*", "", (folder / name).read_text(encoding="utf-8"), flags=re.S)
    return "".join(_read(folder, other, seen) for other in re.findall(r'#include "(\w+\.h)"', text)) + text


def _parameters(text: str) -> list[str]:
    return [" ".join(parameter.split()) for parameter in text.split(",")]


def _callback_name(name: str) -> str:
    return re.sub(r"Clsp(\w+)Function", r"\1_FUNCTION", name).upper()


def _fill(items: Iterable[str], indent: str) -> list[str]:
    """The items, separated by commas, in as few lines as hold them."""
    lines = [indent]
    for item in items:
        if len(lines[-1]) + len(item) + 2 > WIDTH:
            lines.append(indent)
        lines[-1] += ("" if lines[-1] == indent else " ") + item + ","
    return lines


def _tuple(items: list[str]) -> str:
    return f"({', '.join(items)}{',' if len(items) == 1 else ''})"


def python_text(headers: Headers) -> str:
    """The ctypes mirror."""
    lines = [
        '"""The C headers, name by name, for ctypes. Written by scripts/generate_bindings.py: do not edit."""',
        "",
        "# fmt: off",
        "",
        "from __future__ import annotations",
        "",
        "from ctypes import CFUNCTYPE, Structure",
        "from ctypes import POINTER as _P",
    ]
    names = {"char": "char", "char_p": "text", "double": "f64", "float": "f32", "int32": "i32", "uint8": "u8"}
    names |= {"uint16": "u16", "uint32": "u32", "uint64": "u64", "void_p": "void"}
    lines += [f"from ctypes import c_{name} as _{short}" for name, short in names.items()]
    lines += ["from typing import Any", "", f'VERSION = "{headers.version}"', f"ABI_VERSION = {headers.abi}"]

    group: list[str] = []

    def flush() -> None:
        if group:
            lines.append(f"{', '.join(group)} = {', '.join(headers.constants[name] for name in group)}")
            group.clear()

    for name in headers.constants:
        together = [*group, name]
        line = f"{', '.join(together)} = {', '.join(headers.constants[other] for other in together)}"
        if group and (group[0].split("_")[1] != name.split("_")[1] or len(line) > WIDTH):
            flush()
        group.append(name)
    flush()

    callbacks = dict(headers.callbacks)

    def write_callbacks() -> None:
        """Those whose structs are there by now."""
        for name, (result, arguments) in list(callbacks.items()):
            kinds = ["None" if result == "void" else headers.kind(result), *map(headers.kind, arguments)]
            if all(struct in written for struct in re.findall(r"Clsp\w+", " ".join(kinds))):
                lines.extend(["", f"{_callback_name(name)} = CFUNCTYPE({', '.join(kinds)})"])
                del callbacks[name]

    written: set[str] = set()
    for struct, members in headers.structs.items():
        write_callbacks()
        fields = []
        for member in members:
            name = re.search(r"(\w+)(\[\w+\])?$", member)[1]  # type: ignore[index]
            fields.append(f'("{name}", {headers.kind(member, member=True)})')
        lines += ["", "", f"class {struct}(Structure):", "    _fields_ = [", *_fill(fields, "        "), "    ]"]
        written.add(struct)
    lines += ["", ""]

    statuses = {name: arguments for name, (result, arguments) in headers.functions.items() if result == "ClspStatus"}
    lines += ["# The functions that return a status: their argument types."]
    lines += ["FUNCTIONS: dict[str, tuple[Any, ...]] = {"]
    for name, arguments in statuses.items():
        kinds = [headers.kind(argument) for argument in arguments]
        line = f'    "{name}": {_tuple(kinds)},'
        lines += [line] if len(line) <= WIDTH else [f'    "{name}": (', *_fill(kinds, "        "), "    ),"]
    lines += ["}", "", "# The others: (return type, argument types)."]
    lines += ["OTHER_FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {"]
    for name, (result, arguments) in headers.functions.items():
        if name not in statuses:
            lines.append(f'    "{name}": ({headers.kind(result)}, {_tuple([headers.kind(a) for a in arguments])}),')
    lines += ["}", "", "STRUCTS: tuple[type[Structure], ...] = (", *_fill(headers.structs, "    "), ")"]
    return "\n".join(lines) + "\n"


def cpp_text(headers: Headers) -> str:
    """The init() overloads: defaults where the C interface has them, else only the size."""
    lines = [
        "// init(): a struct's defaults where it has some, else its size.",
        "// Written by scripts/generate_bindings.py: do not edit.",
        "// clang-format off",
        "#ifndef CLSPECKLE_INIT_HPP",
        "#define CLSPECKLE_INIT_HPP",
        "",
        "#include <clspeckle/clspeckle.h>",
        "",
        "namespace clspeckle {",
        "void check(ClspStatus status); // in clspeckle.hpp",
        "namespace detail {",
        "",
    ]
    for struct, members in headers.structs.items():
        function = f"c{struct[1:]}Init"
        if function in headers.functions:
            body = f"check({function}(&value, sizeof(value)));"
        elif members[0].endswith(" struct_size"):
            body = "value.struct_size = sizeof(value);"
        else:
            continue  # of one size for ever, and filled by hand
        lines.append(f"inline void init({struct} &value) {{ {body} }}")
    return "\n".join([*lines, "", "} // namespace detail", "} // namespace clspeckle", "", "#endif", ""])


def main() -> int:
    headers = Headers()
    stale = []
    for file, text in ((PYTHON, python_text(headers)), (CPP, cpp_text(headers))):
        if file.is_file() and file.read_text(encoding="utf-8") == text:
            continue
        stale.append(str(file.relative_to(ROOT)))
        if sys.argv[1:] != ["--check"]:
            file.write_text(text, encoding="utf-8")
    if sys.argv[1:] == ["--check"] and stale:
        print(f"{', '.join(stale)}: not what the C headers say; run scripts/generate_bindings.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
