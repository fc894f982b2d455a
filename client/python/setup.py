"""Generates the stubs of mapping.proto and compiles the mesh decoder; both come from the source tree of romap."""

import os
import shutil
import subprocess
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py

TREE = Path(__file__).resolve().parents[2]
PROTO = "romap/v1/mapping.proto"


def tool(name: str, package: str) -> str:
    path = shutil.which(name)
    if path is None:
        raise SystemExit(f"romap: {name} is missing; install the package {package}")
    return path


class GenerateStubs(build_py):
    def run(self) -> None:
        super().run()
        Path(self.build_lib).mkdir(parents=True, exist_ok=True)
        plugin = tool("grpc_python_plugin", "protobuf-compiler-grpc")
        subprocess.run(
            [tool("protoc", "protobuf-compiler"), f"--proto_path={TREE / 'proto'}", f"--python_out={self.build_lib}",
             f"--grpc_python_out={self.build_lib}", f"--plugin=protoc-gen-grpc_python={plugin}", PROTO], check=True)


class CompileDecoder(build_ext):
    """The decoder is the one of the C++ client. Absolute paths keep the objects inside the build folder."""

    def build_extension(self, extension: Extension) -> None:
        here = Path(__file__).resolve().parent
        extension.sources = [str(here / "src/draco_module.cc"), str(TREE / "common/mesh_codec.cc")]
        extension.include_dirs = [str(TREE), *flags("--cflags-only-I", "eigen3")]
        extension.extra_link_args = ["-ldraco", *flags("--libs", "absl_statusor", "fmt")]
        super().build_extension(extension)


def flags(kind: str, *packages: str) -> "list[str]":
    found = subprocess.run([tool("pkg-config", "pkg-config"), kind, *packages], check=True, capture_output=True, text=True)
    return [flag[2:] if kind == "--cflags-only-I" else flag for flag in found.stdout.split()]


os.chdir(Path(__file__).resolve().parent)
setup(
    cmdclass={"build_py": GenerateStubs, "build_ext": CompileDecoder},
    ext_modules=[
        Extension("romap._draco", sources=["src/draco_module.cc"], language="c++", py_limited_api=True,
                  extra_compile_args=["-std=c++20", "-O2", "-w"])
    ],
)
