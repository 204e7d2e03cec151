"""What turns docs/ into a site: hooks of MkDocs, run by `make docs` only."""
