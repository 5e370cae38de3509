"""The page of the study of yield from its table: python docs/yield/make.py."""

from pathlib import Path

from faultgouge.studies.yielding.page import write_page

if __name__ == "__main__":
    print(write_page(Path(__file__).parent))
