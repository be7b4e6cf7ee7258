"""Objects to press into a simulated film: solids, gratings, text, pictures and meshes."""
