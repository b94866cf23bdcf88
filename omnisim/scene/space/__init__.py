"""Space of a scene: floors, enclosures, boxes, start poses."""
