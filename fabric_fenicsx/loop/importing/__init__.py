"""From exports of testing machines and cameras to a folder that `diagnose` reads."""
