"""Print what pyproject.toml declares as lowest versions, as constraints: name==version.

``python .ci/lowest.py`` takes the dependencies and those extras that the tests need.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

#: tools that check and do not run with schuler: any version will do
TOOLS = {"mypy", "ruff", "import-linter", "python-ins", "pytest", "pytest-cov", "coverage"}


def main() -> None:
    """Print the constraints."""
    project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"]
    wanted = [*project["project"]["dependencies"], *extras["dev"]]
    nested = re.findall(r"schuler\[([^\]]*)\]", " ".join(wanted))
    for name in ",".join(nested).split(","):
        wanted += extras[name.strip()]
    for each in sorted(set(wanted)):
        found = re.fullmatch(r"([A-Za-z0-9_.-]+)>=([0-9.]+)", each)
        if found and found[1] not in TOOLS:
            print(f"{found[1]}=={found[2]}")


if __name__ == "__main__":
    main()
