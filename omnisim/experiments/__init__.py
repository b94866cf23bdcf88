"""What robots do with the pictures: learn landmarks, find them, find themselves, and how well."""
