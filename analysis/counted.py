"""A number with its noun, in the singular or the plural."""


def counted(number: int, noun: str, plural: str | None = None) -> str:
    """Say how many: "1 complex pair", "2 complex pairs", "0 rattlers"; the plural is the noun with an s by default."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"
