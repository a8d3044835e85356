"""Pictures of splats: cameras, scenery, films; the renderers themselves are plugins."""
