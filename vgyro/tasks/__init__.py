"""The jobs of the workflow, one module for each rule: its `main` reads files, calls the other rooms, writes files."""
