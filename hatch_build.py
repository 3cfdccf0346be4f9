"""The step of an installation that compiles the core; it brings a compiler along where there is none."""

import importlib.util
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

IMPORTED = ("numpy", "pydantic", "jinja2")


class CompiledCore(BuildHookInterface):
    """Compile native/ into the package, for wheels and for editable installations."""

    def dependencies(self) -> list[str]:
        """Return what the build needs besides the backend: a compiler, if the machine has none, and what is
        imported by the modules of whose constants a C header is made.
        """
        imported = [each for each in self.metadata.core.dependencies if each.startswith(IMPORTED)]
        return imported if self._native().compiler() else [*imported, "ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and name the wheel after the platform: it holds no code for a particular Python."""
        native = self._native()
        libraries = native.build()
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{native.wheel_platform()}"
        build_data["artifacts"] += [f"/{path.relative_to(self.root).as_posix()}" for path in libraries]

    def _native(self) -> Any:
        path = Path(self.root, "native", "build.py")
        spec = importlib.util.spec_from_file_location("native_build", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module
