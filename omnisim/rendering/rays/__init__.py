"""Ray casting: images and ray hits from Embree, without a GPU."""
