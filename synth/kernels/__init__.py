"""Pure numeric kernels: no scene, no truth, nothing but numbers in and numbers out."""
