"""Builds the Unity package: `unity.py OUT.tgz`. Equal sources and compilers give equal bytes."""

from __future__ import annotations

import gzip
import hashlib
import io
import os
import struct
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from aarch64 import STRICT, sources
from build_wasm import ROOT, eigen

PACKAGE = ROOT / "engines/unity"
RECORDING = ROOT / "conformance/v1/colored/vertices.reel"  # that the sample plays
LINUX, WINDOWS, MACOS = ("x86_64-linux-gnu.2.17",), ("x86_64-windows-gnu",), ("x86_64-macos.11.0", "aarch64-macos.11.0")
LIBRARIES = {  # in the package: targets of Zig; Unity's platform and processor, and the editor's system
    "Runtime/Plugins/Linux/libmeshreel.so": (LINUX, "Standalone: Linux64", "x86_64", "Linux"),
    "Runtime/Plugins/Windows/meshreel.dll": (WINDOWS, "Standalone: Win64", "x86_64", "Windows"),
    "Runtime/Plugins/macOS/libmeshreel.dylib": (MACOS, "Standalone: OSXUniversal", "AnyCPU", "OSX"),
    "Runtime/Plugins/Android/libmeshreel.so": ((), "Android: Android", "ARM64", ""),  # by the NDK
}
FLAGS = (
    *("-shared", "-s", "-fPIC", "-fvisibility=hidden", "-fvisibility-inlines-hidden"),
    *("-DMESHREEL_BUILD", "-DNDEBUG"),
)
# Zig's run time does not say which processor it runs on (core/src/wide.h): equal bits, of narrow registers.
NARROW = "-D__builtin_cpu_supports(name)=0"
ANDROID = "toolchains/llvm/prebuilt/*/bin/aarch64-linux-android24-clang++"  # Android 7: pages of 16 KiB for 15
IMPORTERS = {
    "": "folderAsset: yes\nDefaultImporter:\n  externalObjects: {}\n",
    ".asmdef": "AssemblyDefinitionImporter:\n  externalObjects: {}\n",
    ".cs": "MonoImporter:\n  externalObjects: {}\n  serializedVersion: 2\n  defaultReferences: []\n",
    ".json": "PackageManifestImporter:\n  externalObjects: {}\n",
    ".shader": "ShaderImporter:\n  externalObjects: {}\n  defaultTextures: []\n",
    ".bytes": "TextScriptImporter:\n  externalObjects: {}\n",
    ".md": "TextScriptImporter:\n  externalObjects: {}\n",
    ".unity": "DefaultImporter:\n  externalObjects: {}\n",
}


def compiled(compiler: list[str], made: Path) -> bytes:
    """The library as a compiler makes it, which keeps the name of its file."""
    includes = [f"-I{ROOT / 'core/include'}", "-isystem", str(eigen())]
    subprocess.run([*compiler, *STRICT, *FLAGS, *includes, *map(str, sources()), "-o", str(made)], check=True)
    return made.read_bytes()


def universal(libraries: list[bytes]) -> bytes:
    """One Mach-O file of those for several processors, each at a page of its own."""
    head, body, page = struct.pack(">II", 0xCAFEBABE, len(libraries)), b"", 1 << 14
    for library in libraries:
        _, kind, variant = struct.unpack("<III", library[:12])
        body += bytes(-len(body) % page)
        head += struct.pack(">IIIII", kind, variant, page + len(body), len(library), 14)
        body += library
    return head.ljust(page, b"\0") + body


def libraries(folder: Path) -> dict[str, bytes]:
    """Compile all libraries; that of Android where there is an NDK."""
    zig, found = [sys.executable, "-m", "ziglang", "c++", NARROW, "-target"], dict[str, bytes]()
    for name, (targets, *_) in LIBRARIES.items():
        extra = ["-Wl,-install_name,@rpath/libmeshreel.dylib"] if targets == MACOS else []
        made = [compiled([*zig, target, *extra], folder / Path(name).name) for target in targets]
        if made:
            found[name] = made[0] if len(made) == 1 else universal(made)
    if ndk := os.environ.get("ANDROID_NDK_HOME"):
        compilers = sorted(Path(ndk).glob(ANDROID))
        if not compilers:
            sys.exit(f"unity: ANDROID_NDK_HOME {ndk}: no {ANDROID} there; give the folder of an NDK of r21 or later")
        pages = "-Wl,-z,max-page-size=16384"
        compiler, name = [str(compilers[0]), "-static-libstdc++", pages], [*LIBRARIES][-1]
        found[name] = compiled(compiler, folder / Path(name).name)
    return found


def plugin(name: str) -> str:
    """The importer of a library: on its platform, and in the editor there."""
    _, platform, processor, system = LIBRARIES[name]
    rows = [("Any: ", 0, {}), (platform, 1, {"CPU": processor})]
    rows += (
        [("Editor: Editor", 1, {"CPU": processor, "DefaultValueInitialized": "true", "OS": system})] if system else []
    )
    text = "PluginImporter:\n  externalObjects: {}\n  serializedVersion: 2\n  isPreloaded: 0\n  platformData:\n"
    for first, enabled, settings in rows:
        text += f"  - first:\n      {first}\n    second:\n      enabled: {enabled}\n      settings:"
        text += "".join(f"\n        {key}: {value}" for key, value in settings.items()) if settings else " {}"
        text += "\n"
    return text


def guid(name: str) -> str:
    """The number by which Unity's files name another: the same in all versions of the package."""
    return hashlib.md5(f"meshreel/{name}".encode(), usedforsecurity=False).hexdigest()


def package(built: dict[str, bytes]) -> bytes:
    """The package as a tarball, which Unity's package manager takes."""
    files = {path.relative_to(PACKAGE).as_posix(): path.read_bytes() for path in PACKAGE.rglob("*") if path.is_file()}
    files |= built | {"Samples~/Play/recording.bytes": RECORDING.read_bytes()}
    files |= {f"{name}.md": (ROOT / name).read_bytes() for name in ("LICENSE", "NOTICE")}
    names = {*files} | {parent.as_posix() for name in files for parent in Path(name).parents} - {".", "Samples~"}
    for name in names:
        importer = plugin(name) if name in built else IMPORTERS[Path(name).suffix if name in files else ""]
        files[f"{name}.meta"] = f"fileFormatVersion: 2\nguid: {guid(name)}\n{importer}".encode()
    out = io.BytesIO()
    with (
        gzip.GzipFile(fileobj=out, mode="wb", mtime=0, filename="") as packed,
        tarfile.open(fileobj=packed, mode="w") as tar,
    ):
        for name, data in sorted(files.items()):
            entry = tarfile.TarInfo(f"package/{name}")
            entry.size, entry.mode = len(data), 0o644
            tar.addfile(entry, io.BytesIO(data))
    return out.getvalue()


def main(arguments: list[str]) -> int:
    """The exit code."""
    if len(arguments) != 1:
        print("usage: unity.py OUT.tgz", file=sys.stderr)
        return 2
    out = Path(arguments[0])
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out.parent) as folder:
        built = libraries(Path(folder))
        made = Path(folder) / "package.tgz"
        made.write_bytes(package(built))
        made.replace(out)
    for name in LIBRARIES:
        print(
            f"{name}: {len(built[name])} bytes" if name in built else f"{name}: left out, ANDROID_NDK_HOME is not set"
        )
    print(f"{out}: in Unity, Window > Package Manager > + > Add package from tarball")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
