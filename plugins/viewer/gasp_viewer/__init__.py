"""`gasp view`: recordings and splat files in the browser, by viser."""
