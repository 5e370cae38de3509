"""The pages of the study of yield from their tables: python -m research.yielding.make."""

from pathlib import Path

from research.yielding.page import write_lasting, write_page

if __name__ == "__main__":
    folder = Path(__file__).parent
    print(write_page(folder), write_lasting(folder), sep="\n")
