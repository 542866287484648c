"""Pictures: the rasteriser, pixel observations, the renderer and a window."""
