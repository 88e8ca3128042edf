"""Chunks that HDF5 would believe: it reads on beyond one that unpacks to too little, and unpacks whatever there is."""

from __future__ import annotations

import math
import zlib

from h5py import h5d, h5z

from .guard_types import is_text

_SUM = 4  # bytes of fletcher32


def full_chunks(array: h5d.DatasetID) -> None:
    """Look whether each chunk of an array unpacks to its size; `ValueError` or `zlib.error` if not."""
    made, kind = array.get_create_plist(), array.get_type()
    if made.get_layout() != h5d.CHUNKED or (is_text(kind) and kind.is_variable_str()):
        return
    size = math.prod(made.get_chunk()) * kind.get_size()
    most = size + size // 500 + 64  # bytes of a chunk of noise, which deflate makes longer
    filters = [made.get_filter(index)[0] for index in range(made.get_nfilters())]
    chunks: list[h5d.StoreInfo] = []
    array.chunk_iter(chunks.append)
    for chunk in chunks:
        there = chunk.size
        if filters and there <= most:
            data = array.read_direct_chunk(chunk.chunk_offset)[1]
            for index in reversed(range(len(filters))):
                if chunk.filter_mask >> index & 1:  # left out where it does not shorten
                    continue
                if filters[index] == h5z.FILTER_DEFLATE:
                    data = zlib.decompressobj().decompress(data, most)
                elif filters[index] == h5z.FILTER_FLETCHER32:
                    data = data[:-_SUM]
            there = len(data)
        if there != size:
            raise ValueError(f"a chunk of {there} bytes instead of {size}")
