"""Pictures of results: figures, contact sheets, maps and videos."""
