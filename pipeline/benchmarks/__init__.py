"""The project's measured claims: each suite is a module with `run(*, quick, folder)` that yields flat rows."""
