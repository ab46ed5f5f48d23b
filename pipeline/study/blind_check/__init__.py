"""The blind check: sealed data of an engine that `diagnose` has never met, its verdicts, and how they are scored."""
