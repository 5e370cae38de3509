"""Builds the packages of recipe.yaml and runs their tests: python conda/build.py FOLDER CHANNEL..., as `make conda`."""

import sys
from pathlib import Path

from rattler_build import Stage0Recipe, ToolConfiguration
from rattler_build.progress import SimpleProgressCallback

folder, *channels = sys.argv[1:]
recipe = Stage0Recipe.from_file(Path(__file__).with_name("recipe.yaml"))
recipe.run_build(
    tool_config=ToolConfiguration(test_strategy="native"),
    output_dir=folder,
    channels=channels,
    progress_callback=SimpleProgressCallback(),
)
