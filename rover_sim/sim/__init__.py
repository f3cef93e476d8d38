"""The physical world of one run: rover, soil forces, rocks, sensors and cameras."""
