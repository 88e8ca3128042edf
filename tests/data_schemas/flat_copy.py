"""A file without groups: for tools that do not look into them, CF checkers among others."""

from __future__ import annotations

from typing import TYPE_CHECKING

from data_schemas.contents import Contents, Entry, Group, from_tree, to_tree

if TYPE_CHECKING:
    import xarray as xr


def flatten(tree: xr.DataTree) -> xr.DataTree:
    """A copy of a tree with all variables at the root, named ``group__name``; the root's keep their names.

    Dimensions are renamed alike, but for those of the root; attributes of groups become ``group__attribute``.

    Raises
    ------
    FileError
        A variable or attribute has a type that no file can hold.
    """
    contents = from_tree(tree)
    shared = {dim for entry in contents[""].variables.values() for dim in entry.dims}
    flat = Group()
    for path, group in contents.items():
        prefix = path.replace("/", "__") + "__" if path else ""
        flat.attrs |= {prefix + name: value for name, value in group.attrs.items()}
        for name, entry in group.variables.items():
            dims = tuple(dim if dim in shared else prefix + dim for dim in entry.dims)
            flat.variables[prefix + name] = Entry(dims, entry.values, dict(entry.attrs))
    whole: Contents = {"": flat}
    return to_tree(whole)
