"""Recipes of Conan, vcpkg and conda: what they say is what the project is, and what each names is there."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from install_common import BUILD, ROOT, release, run

PACKAGING = ROOT / "packaging"
CONAN = Path(sys.executable).with_name("conan")
VCPKG = PACKAGING / "vcpkg" / "ports" / "clspeckle"
CONDA = PACKAGING / "conda" / "recipe.yaml"
# The folders that the library is built of.
BUILT = ("bindings", "capi", "cmake", "core", "diagnosis", "io", "kernels", "tuning")


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    variables = {"CONAN_HOME": str(tmp_path_factory.mktemp("conan"))}
    run(CONAN, "profile", "detect", env=variables)
    return variables


@pytest.fixture(scope="module")
def inspected(home: dict[str, str]) -> dict[str, Any]:
    return json.loads(run(CONAN, "inspect", PACKAGING / "conan", "--format", "json", env=home))


def rendered() -> Any:
    """conda's recipe as rattler-build renders it; it refuses members that there are not."""
    import rattler_build

    recipe = rattler_build.Stage0Recipe.from_file(str(CONDA))
    variants = rattler_build.VariantConfig({"c_stdlib": ["sysroot"], "c_stdlib_version": ["2.28"], "python": ["3.11"]})
    (one,) = recipe.render(variants, rattler_build.RenderConfig())
    return one.recipe


def test_versions_and_licences_are_the_projects(inspected: dict[str, Any]) -> None:
    version, _ = release()
    port, conda = json.loads((VCPKG / "vcpkg.json").read_text()), rendered()
    about = re.search(r'^description = "(.*)"$', (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
    assert about is not None
    said = (version, "MIT", about[1])
    assert (inspected["version"], inspected["license"], inspected["description"]) == said
    assert (port["version-semver"], port["license"], port["description"]) == said
    assert (str(conda.package.version), str(conda.about.license), str(conda.about.summary)) == said
    assert {inspected["name"], port["name"], str(conda.package.name)} == {"clspeckle"}
    assert (ROOT / "LICENSE").read_text().startswith("MIT License")


def test_what_conan_exports_can_be_configured(home: dict[str, str], tmp_path: Path) -> None:
    """The same sources as here, of the same folders; and the recipe has an answer for Conan's own graph."""
    told = run(CONAN, "export", PACKAGING / "conan", "--format", "json", env=home)
    reference = json.loads(told)["reference"].partition("#")[0]
    assert reference == f"clspeckle/{release()[0]}"
    graph = json.loads(run(CONAN, "graph", "info", f"--requires={reference}", "--build=*", "--format=json", env=home))
    (node,) = [node for node in graph["graph"]["nodes"].values() if node["ref"].startswith("clspeckle/")]
    assert node["binary"] == "Build"
    (types,) = Path(home["CONAN_HOME"]).rglob("types.h")
    source = types.parents[3]
    options = [f"-DCLSP_BUILD_{part}=OFF" for part in ("TOOLS", "EXAMPLES", "TESTS", "BENCH")]
    run("cmake", "-S", source, "-B", tmp_path, *options)

    def sources(build: Path, root: Path) -> set[str]:
        files = [Path(entry["file"]) for entry in json.loads((build / "compile_commands.json").read_text())]
        names = {str(file.relative_to(root)) for file in files if file.is_relative_to(root)}
        return {name for name in names if name.split("/")[0] in BUILT}

    # The program's part of io/ is no part of the library.
    assert sources(tmp_path, source) == sources(BUILD, ROOT) - {"io/openexr.cpp"}


@pytest.mark.nightly
def test_conan_makes_a_package_that_c_and_cpp_use(home: dict[str, str], tmp_path: Path) -> None:
    """Built from the exported sources, packed, and used by the recipe's test package: no package of any server."""
    # Nothing in the checkout.
    settings = (f"tools.cmake.cmake_layout:test_folder={tmp_path}", "tools.cmake.cmaketoolchain:user_presets=")
    elsewhere = [word for setting in settings for word in ("-c", setting)]
    done = run(CONAN, "create", PACKAGING / "conan", "--build=missing", "--no-remote", *elsewhere, env=home)
    assert done.count("first codes: ") == 2
    (library,) = {path.name for path in Path(home["CONAN_HOME"]).rglob("p/lib/libclspeckle.so.*.*.*")}
    assert library == f"libclspeckle.so.{release()[0]}"


def test_conan_names_the_packages_of_the_guide() -> None:
    named = set(re.findall(r'^ +"([a-z0-9-]+)",$', (PACKAGING / "conan" / "conanfile.py").read_text(), re.MULTILINE))
    setup = (ROOT / "scripts" / "setup.sh").read_text().partition("packages=(")[2].partition(")")[0].split()
    assert {"libclfft-dev", "libjs-vega"} <= named <= set(setup)
    # The rest is the program's, or runs it.
    others = {"build-essential", "cmake", "ninja-build", "pocl-opencl-icd", "libcli11-dev", "libopenexr-dev"}
    assert set(setup) - named == {*others, "python3", "python3-venv"}


def test_vcpkgs_port_is_one() -> None:
    """By the fields of vcpkg's schema; the options and functions of its script are there."""
    port = json.loads((VCPKG / "vcpkg.json").read_text())
    assert set(port) <= {"$schema", "name", "version-semver", "description", "license", "supports", "dependencies"}
    names = [entry if isinstance(entry, str) else entry["name"] for entry in port["dependencies"]]
    assert names == sorted(set(names))
    assert all(re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", name) for name in [port["name"], *names])
    for entry in port["dependencies"]:
        assert isinstance(entry, str) or set(entry) <= {"name", "host", "default-features", "features"}
    script = (VCPKG / "portfile.cmake").read_text()
    listed = [*ROOT.glob("CMakeLists.txt"), *ROOT.glob("io/CMakeLists.txt"), *ROOT.glob("diagnosis/**/*.cmake")]
    known = "".join(path.read_text() for path in listed)
    for name in re.findall(r"-D(CLSP_\w+)=", script + CONDA.read_text()):
        assert re.search(rf"(option|find_path)\({name}\b", known), name
    assert (VCPKG / "../../../.." / "CMakeLists.txt").is_file()
    assert re.search(r"SHA512 [0-9a-f]{128}\n", script)
    # Both recipes take the same file of Vega.
    urls = re.findall(r"https://deb\.debian\.org/\S+\.deb", script + CONDA.read_text())
    assert len(urls) == 2
    assert len(set(urls)) == 1
