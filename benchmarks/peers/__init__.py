"""Other ways to the same frame, made as their own makers would: README.md says how."""
