"""Drawing: the rasterizer, pixel observations, the renderer and a window."""
