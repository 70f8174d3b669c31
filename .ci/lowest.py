"""Print the lowest versions that pyproject.toml allows, as constraints for pip.

``python3 .ci/lowest.py > lowest.txt``: every ``name>=version`` of the dependencies and of the
extras that users install.
"""

import re
import tomllib
from pathlib import Path

EXTRAS = ("study", "office", "cluster", "control", "fast", "film", "studio")

project = tomllib.loads(Path("pyproject.toml").read_text("utf-8"))["project"]
extras = project["optional-dependencies"]
for requirement in [*project["dependencies"], *(r for e in EXTRAS for r in extras[e])]:
    if bound := re.fullmatch(r"([\w.-]+)>=([\w.]+)", requirement):
        print(f"{bound[1]}=={bound[2]}")
