"""Motion and stock to Forces: cutters, height field, engagement, force laws."""
