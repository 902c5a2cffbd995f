"""The mirror of the C headers, and the search for the shared library."""

from __future__ import annotations

import ctypes
import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import clspeckle
from binding_common import Runner
from clspeckle import _library

PACKAGE = Path(clspeckle.__file__).parent


def generator(root: Path) -> Any:
    """scripts/generate_bindings.py as a module."""
    spec = importlib.util.spec_from_file_location("generate_bindings", root / "scripts" / "generate_bindings.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def header_text(root: Path) -> str:
    return str(generator(root).Headers().text)


def test_what_is_generated_is_what_the_headers_say(root: Path) -> None:
    """Run scripts/generate_bindings.py after a change of the headers."""
    made = generator(root)
    headers = made.Headers()
    assert made.PYTHON.read_text(encoding="utf-8") == made.python_text(headers)
    assert made.CPP.read_text(encoding="utf-8") == made.cpp_text(headers)


def test_a_changed_header_makes_what_is_generated_stale(root: Path, tmp_path: Path) -> None:
    copy = tmp_path / "checkout"
    for folder in ("capi/include", "bindings/python/src/clspeckle", "bindings/cpp/include", "scripts"):
        shutil.copytree(root / folder, copy / folder, ignore=shutil.ignore_patterns("__pycache__", "*.so"))
    command = [sys.executable, str(copy / "scripts" / "generate_bindings.py")]

    def stale() -> str:
        result = subprocess.run([*command, "--check"], capture_output=True, text=True, timeout=60, check=False)
        assert result.returncode == bool(result.stderr)
        return result.stderr

    assert stale() == ""
    header = copy / "capi" / "include" / "clspeckle" / "tuning.h"
    text = header.read_text(encoding="utf-8")
    header.write_text(text.replace("uint32_t keep;", "uint16_t keep;"), encoding="utf-8")
    assert "_generated.py" in stale()
    subprocess.run(command, check=True, timeout=60)
    assert stale() == ""
    header.write_text(text.replace("uint32_t keep;", "long keep;"), encoding="utf-8")
    assert "the type long is not known here" in stale()


def compile_c(source: str, target: Path, *options: str) -> None:
    compiler = shutil.which("cc")
    assert compiler, "the tests need a C compiler: install gcc"
    file = target.with_suffix(".c")
    file.write_text(source, encoding="utf-8")
    subprocess.run([compiler, "-std=c99", *options, str(file), "-o", str(target)], check=True, timeout=120)


def output_of(source: str, tmp_path: Path, headers: Path) -> list[str]:
    program = tmp_path / "program"
    compile_c("#include <stdio.h>\n#include <clspeckle/clspeckle.h>\n" + source, program, f"-I{headers}")
    result = subprocess.run([str(program)], check=True, capture_output=True, text=True, timeout=60)
    return result.stdout.splitlines()


def test_every_struct_is_mirrored(header_text: str) -> None:
    in_headers = set(re.findall(r"typedef struct (Clsp\w+) \{", header_text))
    assert len(in_headers) > 10
    assert {struct.__name__ for struct in _library.STRUCTS} == in_headers


def test_layout_of_structs_is_the_c_compilers(headers: Path, tmp_path: Path) -> None:
    lines = []
    expected = []
    for struct in _library.STRUCTS:
        name = struct.__name__
        names = [field[0] for field in struct._fields_]
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        expected.append(f"{name} {ctypes.sizeof(struct)}")
        for member in names:
            field = getattr(struct, member)
            lines.append(
                f'printf("{name}.{member} %zu %zu\\n", offsetof({name}, {member}), sizeof((({name} *)0)->{member}));'
            )
            expected.append(f"{name}.{member} {field.offset} {field.size}")
    source = "int main(void) {\n" + "\n".join(lines) + "\nreturn 0;\n}\n"
    assert output_of(source, tmp_path, headers) == expected


def test_constants_are_those_of_the_headers(header_text: str, headers: Path, tmp_path: Path) -> None:
    in_headers = set(re.findall(r"#define (CLSP_\w+) \(?-?\d", header_text))
    in_headers -= {name for name in in_headers if name.startswith(("CLSP_ERROR_", "CLSP_VERSION_", "CLSP_ABI"))}
    mirrored = {name for name in vars(_library) if name.startswith("CLSP_")}
    assert mirrored == in_headers
    names = sorted(mirrored)
    source = "int main(void) {\n" + "\n".join(f'printf("%ld\\n", (long){name});' for name in names) + "\nreturn 0;\n}\n"
    assert [int(line) for line in output_of(source, tmp_path, headers)] == [getattr(_library, name) for name in names]


def test_version_numbers_agree(header_text: str) -> None:
    numbers = {
        name: int(re.search(rf"#define {name} (\d+)", header_text)[1])  # type: ignore[index]
        for name in ("CLSP_VERSION_MAJOR", "CLSP_VERSION_MINOR", "CLSP_VERSION_PATCH", "CLSP_ABI_VERSION")
    }
    major, minor, patch, abi = numbers.values()
    assert clspeckle.version() == clspeckle.Version(major, minor, patch, abi)
    assert clspeckle.__version__ == str(clspeckle.version()) == f"{major}.{minor}.{patch}"
    assert abi == _library.ABI_VERSION


# --- Functions ---


def test_every_function_of_the_headers_is_bound(header_text: str) -> None:
    bound = set(_library.FUNCTIONS) | set(_library.OTHER_FUNCTIONS)
    assert bound == set(re.findall(r"\b(clsp\w+)\(", header_text))
    library = _library.library()
    for name, arguments in _library.FUNCTIONS.items():
        function = getattr(library, name)
        assert (function.restype, tuple(function.argtypes)) == (ctypes.c_int32, arguments), name


def test_every_exported_symbol_is_bound_and_nothing_else_is_exported() -> None:
    nm = shutil.which("nm")
    assert nm, "the tests need nm: install binutils"
    path = library_file()
    listing = subprocess.run(
        [nm, "-D", "--defined-only", str(path)], check=True, capture_output=True, text=True, timeout=60
    )
    symbols = [line.split() for line in listing.stdout.splitlines()]
    exported = {words[2].split("@")[0] for words in symbols if words[1] in "TtDBRVWi"}
    assert exported == set(_library.FUNCTIONS) | set(_library.OTHER_FUNCTIONS)


def library_file() -> Path:
    """The file that this process has loaded."""
    name = _library.library()._name
    if "/" in name:
        return Path(name)
    maps = Path("/proc/self/maps").read_text(encoding="ascii")
    return Path(re.search(r"(/\S*/libclspeckle\.so\S*)", maps)[1])  # type: ignore[index]


# --- Loading ---


def test_import_loads_neither_the_library_nor_pyopencl(run_python: Runner) -> None:
    result = run_python(
        "import sys, clspeckle\n"
        "from clspeckle import _library\n"
        "assert _library._library is None\n"
        "assert 'pyopencl' not in sys.modules\n",
        CLSPECKLE_LIBRARY="/nonexistent/libclspeckle.so",
    )
    assert result.returncode == 0, result.stderr


LOAD = """
import clspeckle
try:
    clspeckle.version()
except clspeckle.errors.LibraryLoadError as error:
    assert isinstance(error, ImportError)
    print(error)
else:
    from clspeckle import _library
    print("loaded", _library.library()._name)
"""


def test_a_library_that_is_nowhere_is_explained_with_all_places(run_python: Runner, tmp_path: Path) -> None:
    # A copy of the package outside of the checkout: neither a library beside it nor a build folder.
    shutil.copytree(PACKAGE, tmp_path / "site" / "clspeckle", ignore=shutil.ignore_patterns("lib*", "__pycache__"))
    result = run_python(LOAD, package=tmp_path / "site", CLSPECKLE_LIBRARY="", LD_LIBRARY_PATH="")
    assert result.returncode == 0, result.stderr
    assert str(tmp_path / "site" / "clspeckle" / "libclspeckle.so") in result.stdout
    assert "the system's loader" in result.stdout
    assert "pip install" in result.stdout
    assert "CLSPECKLE_LIBRARY" in result.stdout


def test_the_library_inside_the_package_is_taken(run_python: Runner, tmp_path: Path) -> None:
    package = tmp_path / "site" / "clspeckle"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("lib*", "__pycache__"))
    shutil.copy(library_file(), package / "libclspeckle.so")
    result = run_python(LOAD, package=tmp_path / "site", CLSPECKLE_LIBRARY="")
    assert result.stdout.split() == ["loaded", str(package / "libclspeckle.so")], result.stderr


def test_the_build_folder_of_a_checkout_is_taken(run_python: Runner, tmp_path: Path) -> None:
    package = tmp_path / "checkout" / "bindings" / "python" / "src" / "clspeckle"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("lib*", "__pycache__"))
    header = tmp_path / "checkout" / "capi" / "include" / "clspeckle" / "clspeckle.h"
    header.parent.mkdir(parents=True)
    header.touch()
    built = tmp_path / "checkout" / "build" / "lib" / "libclspeckle.so"
    built.parent.mkdir(parents=True)
    shutil.copy(library_file(), built)
    result = run_python(LOAD, package=package.parent, CLSPECKLE_LIBRARY="")
    assert result.stdout.split() == ["loaded", str(built)], result.stderr


def test_a_named_file_that_is_missing_is_an_error_and_no_other_is_taken(run_python: Runner) -> None:
    result = run_python(LOAD, CLSPECKLE_LIBRARY="/nonexistent/libclspeckle.so")
    assert "/nonexistent/libclspeckle.so (environment variable CLSPECKLE_LIBRARY): no such file" in result.stdout
    assert "system's loader" not in result.stdout


def test_a_file_that_is_no_library_is_an_error(run_python: Runner, tmp_path: Path) -> None:
    (tmp_path / "text.so").write_text("not a library")
    result = run_python(LOAD, CLSPECKLE_LIBRARY=str(tmp_path / "text.so"))
    assert "text.so (environment variable CLSPECKLE_LIBRARY)" in result.stdout


def test_a_system_without_the_loader_of_opencl_is_told_what_to_install(run_python: Runner, tmp_path: Path) -> None:
    # A name that no system has, and that the linker found while it was there.
    loader = tmp_path / "libOpenCL.so.99"
    compile_c("int clNothing(void) { return 0; }", loader, "-shared", "-fPIC", f"-Wl,-soname,{loader.name}")
    options = ("-shared", "-fPIC", "-Wl,--no-as-needed", str(loader))
    compile_c(fake_library(_library.ABI_VERSION), tmp_path / "ours.so", *options)
    loader.unlink()
    result = run_python(LOAD, CLSPECKLE_LIBRARY=str(tmp_path / "ours.so"))
    assert "needs OpenCL's loader" in result.stdout, result.stderr
    assert "libOpenCL.so.99" in result.stdout
    named = re.search(r"apt-get install ([\w-]+) ([\w-]+)\.", result.stdout)
    assert named, result.stdout
    for package in named.groups():
        subprocess.run(["apt-cache", "show", package], check=True, capture_output=True, timeout=60)
    assert "CLSPECKLE_LIBRARY to its file" not in result.stdout


def test_another_library_is_refused(run_python: Runner, tmp_path: Path) -> None:
    compile_c("int something(void) { return 1; }", tmp_path / "other.so", "-shared", "-fPIC")
    result = run_python(LOAD, CLSPECKLE_LIBRARY=str(tmp_path / "other.so"))
    assert "has no function clspGetVersion" in result.stdout


def fake_library(abi: int) -> str:
    return (
        "#include <stdint.h>\n"
        "int32_t clspGetVersion(uint32_t *major, uint32_t *minor, uint32_t *patch, uint32_t *abi) {\n"
        f"    (void)major; (void)minor; (void)patch; *abi = {abi}; return 0;\n}}\n"
    )


def test_another_abi_is_refused(run_python: Runner, tmp_path: Path) -> None:
    compile_c(fake_library(_library.ABI_VERSION + 1), tmp_path / "newer.so", "-shared", "-fPIC")
    result = run_python(LOAD, CLSPECKLE_LIBRARY=str(tmp_path / "newer.so"))
    assert (
        f"has ABI number {_library.ABI_VERSION + 1}, this Python package needs {_library.ABI_VERSION}" in result.stdout
    )


def test_a_library_that_lacks_a_function_is_refused(run_python: Runner, tmp_path: Path) -> None:
    compile_c(fake_library(_library.ABI_VERSION), tmp_path / "older.so", "-shared", "-fPIC")
    result = run_python(LOAD, CLSPECKLE_LIBRARY=str(tmp_path / "older.so"))
    assert "has no function clspGetLastError" in result.stdout
    assert "older than this Python package" in result.stdout


def test_defaults_are_what_the_init_functions_write() -> None:
    # Each description comes back with its size and with defaults that a zeroed struct has not.
    for struct in _library.STRUCTS:
        name = "c" + struct.__name__[1:] + "Init"
        if name in _library.FUNCTIONS:
            assert _library.initialized(struct).struct_size == ctypes.sizeof(struct), name
    assert _library.initialized(_library.ClspSensorDesc).bits == clspeckle.Sensor.defaults()["bits"] == 10
    assert _library.initialized(_library.ClspPhaseDesc).polarization_count == 2
    assert _library.initialized(_library.ClspPatternDesc).power_scale == 1.0
