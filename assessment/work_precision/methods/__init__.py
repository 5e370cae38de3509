"""Work-precision studies: each file has one study, a function from `Settings` to a `Study`; `report` puts
them together."""
