"""The library as others get it: installed (CMake package, pkg-config) and as a part of their build, in C and C++."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from install_common import BUILD, CC, CXX, HERE, ROOT, STRICT, checksum, configure, release, run


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("prefix")
    run("cmake", "--install", BUILD, "--prefix", folder)
    return folder


@pytest.fixture(scope="module")
def libdir(prefix: Path) -> Path:
    found = sorted(prefix.rglob("libclspeckle.so"))
    assert len(found) == 1, f"libclspeckle.so is there {len(found)} times"
    return found[0].parent


@pytest.fixture(scope="module")
def expected(prefix: Path, libdir: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The checksum of the C consumer, compiled by hand."""
    program = tmp_path_factory.mktemp("by_hand") / "consumer"
    run(
        CC,
        "-std=c99",
        *STRICT,
        HERE / "consumer.c",
        f"-I{prefix / 'include'}",
        f"-L{libdir}",
        "-lclspeckle",
        "-o",
        program,
    )
    return checksum(program, LD_LIBRARY_PATH=str(libdir))


def test_installed_files(prefix: Path, libdir: Path) -> None:
    headers = {path.name for path in (prefix / "include" / "clspeckle").iterdir()}
    folders = (ROOT / "capi" / "include" / "clspeckle", ROOT / "bindings" / "cpp" / "include" / "clspeckle")
    assert headers == {path.name for folder in folders for path in folder.iterdir()}
    version, abi = release()
    assert (libdir / f"libclspeckle.so.{version}").is_file()
    soname = run("readelf", "-d", libdir / "libclspeckle.so")
    assert f"[libclspeckle.so.{abi}]" in soname
    assert (libdir / f"libclspeckle.so.{abi}").resolve() == (libdir / f"libclspeckle.so.{version}").resolve()
    assert "RUNPATH" not in soname, "the installed library looks into the build folder"
    assert "RPATH" not in soname, "the installed library looks into the build folder"


def test_installed_files_name_no_folder_of_the_build(prefix: Path) -> None:
    for path in [*prefix.rglob("*.cmake"), *prefix.rglob("*.pc"), *prefix.rglob("*.h"), *prefix.rglob("*.hpp")]:
        text = path.read_text()
        assert str(BUILD) not in text, path
        assert str(ROOT) not in text, path


def test_installed_program(prefix: Path) -> None:
    """It finds its library, and the generator of the check, without any setting."""
    program = prefix / "bin" / "clspeckle"
    assert "clspeckle" in run(program, "--version")
    assert str(BUILD) not in run("readelf", "-d", program)
    assert (prefix / "share" / "clspeckle" / "gap_check" / "__main__.py").is_file()


def test_installed_completion_and_manual(prefix: Path) -> None:
    share = prefix / "share"
    for shell, file in (
        ("bash", "bash-completion/completions/clspeckle"),
        ("zsh", "zsh/site-functions/_clspeckle"),
        ("fish", "fish/vendor_completions.d/clspeckle.fish"),
    ):
        assert (share / file).read_text() == run(prefix / "bin" / "clspeckle", "completion", shell)
    assert (share / "man" / "man1" / "clspeckle.1").read_text() == run(prefix / "bin" / "clspeckle", "man")


def test_find_package(prefix: Path, expected: str, tmp_path: Path) -> None:
    configure(HERE / "find_package", tmp_path, f"-DCMAKE_PREFIX_PATH={prefix}")
    run("cmake", "--build", tmp_path)
    for program in ("consumer_c", "consumer_cpp"):
        assert checksum(tmp_path / program) == expected


def test_find_package_refuses_another_version(prefix: Path, tmp_path: Path) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\nproject(consumer LANGUAGES C CXX)\n"
        "find_package(clspeckle 99.0 REQUIRED)\n"
    )
    done = subprocess.run(
        ["cmake", "-S", tmp_path, "-B", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={prefix}"],
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode != 0
    assert "99.0" in done.stderr


@pytest.mark.parametrize(
    ("compiler", "standard", "source"), [(CC, "c99", "consumer.c"), (CXX, "c++17", "consumer.cpp")]
)
def test_pkg_config(compiler: str, standard: str, source: str, libdir: Path, expected: str, tmp_path: Path) -> None:
    path = {"PKG_CONFIG_PATH": str(libdir / "pkgconfig")}
    flags = run("pkg-config", "--cflags", "--libs", "clspeckle", env=path).split()
    program = tmp_path / "consumer"
    run(compiler, f"-std={standard}", *STRICT, HERE / source, *flags, "-o", program)
    assert checksum(program, LD_LIBRARY_PATH=str(libdir)) == expected
    assert run("pkg-config", "--modversion", "clspeckle", env=path).strip() == release()[0]


@pytest.fixture(scope="module")
def static_prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The static library alone, installed; compiled alike, for a compiler cache."""
    build, folder = tmp_path_factory.mktemp("static_build"), tmp_path_factory.mktemp("static")
    parts = [f"-DCLSP_BUILD_{part}=OFF" for part in ("TOOLS", "EXAMPLES", "TESTS", "BENCH")]
    configure(ROOT, build, "-DBUILD_SHARED_LIBS=OFF", "-DCMAKE_BUILD_TYPE=Release", "-DCLSP_WARNINGS_AS_ERRORS=ON",
              *parts)  # fmt: skip
    run("cmake", "--build", build, "--parallel", "2")
    run("cmake", "--install", build, "--prefix", folder)
    return folder


def stands_alone(program: Path, expected: str) -> None:
    assert "libclspeckle" not in run("readelf", "-d", program)
    assert checksum(program) == expected


def test_static_library_by_cmake(static_prefix: Path, expected: str, tmp_path: Path) -> None:
    assert not list(static_prefix.rglob("*.so*"))
    configure(HERE / "find_package", tmp_path, f"-DCMAKE_PREFIX_PATH={static_prefix}")
    run("cmake", "--build", tmp_path)
    for program in ("consumer_c", "consumer_cpp"):
        stands_alone(tmp_path / program, expected)


def test_static_library_in_a_project_of_c_alone(static_prefix: Path, expected: str, tmp_path: Path) -> None:
    (tmp_path / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.22)\nproject(consumer LANGUAGES C)\nfind_package(clspeckle REQUIRED)\n"
        f"add_executable(consumer {HERE / 'consumer.c'})\ntarget_link_libraries(consumer clspeckle::clspeckle)\n"
    )
    build = tmp_path / "build"
    run("cmake", "-S", tmp_path, "-B", build, f"-DCMAKE_C_COMPILER={CC}", f"-DCMAKE_PREFIX_PATH={static_prefix}")
    run("cmake", "--build", build)
    stands_alone(build / "consumer", expected)


def test_static_library_by_pkg_config(static_prefix: Path, expected: str, tmp_path: Path) -> None:
    path = {"PKG_CONFIG_PATH": str(next(static_prefix.rglob("clspeckle.pc")).parent)}
    flags = run("pkg-config", "--static", "--cflags", "--libs", "clspeckle", env=path).split()
    run(CC, "-std=c99", *STRICT, HERE / "consumer.c", *flags, "-o", tmp_path / "consumer")
    stands_alone(tmp_path / "consumer", expected)


def test_tests_of_a_static_library_are_refused(tmp_path: Path) -> None:
    command = ["cmake", "-S", ROOT, "-B", tmp_path, "-DBUILD_SHARED_LIBS=OFF", "-DCLSP_BUILD_TESTS=ON"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode != 0
    assert "-DCLSP_BUILD_TESTS=OFF" in done.stderr


@pytest.mark.parametrize("way", ["add_subdirectory", "fetch_content"])
def test_part_of_another_build(way: str, expected: str, tmp_path: Path) -> None:
    # The library's own flags are those of its own build, so that a compiler cache need not compile it again.
    configure(HERE / way, tmp_path, f"-DCLSPECKLE_SOURCE={ROOT}", "-DCMAKE_BUILD_TYPE=Release",
              "-DCLSP_WARNINGS_AS_ERRORS=ON")  # fmt: skip
    run("cmake", "--build", tmp_path, "--parallel", "2")
    for program in ("consumer_c", "consumer_cpp"):
        assert checksum(tmp_path / program) == expected


def test_moved_prefix(prefix: Path, expected: str, tmp_path: Path) -> None:
    """The package works from wherever it is moved to."""
    moved = tmp_path / "moved"
    run("cp", "-a", prefix, moved)
    configure(HERE / "find_package", tmp_path / "build", f"-DCMAKE_PREFIX_PATH={moved}")
    run("cmake", "--build", tmp_path / "build")
    assert checksum(tmp_path / "build" / "consumer_c") == expected
    linked = run("ldd", tmp_path / "build" / "consumer_c")
    assert str(moved) in linked
