"""What a run knows of its world, described, exported, and asked in SPARQL."""
