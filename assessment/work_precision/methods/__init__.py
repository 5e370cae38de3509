"""Work-precision studies: one file a study, each a function from `Settings` to a `Study`; `report` puts them
together."""
