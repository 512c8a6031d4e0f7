"""From forms to numbers: dof maps, assembly, Newton by SNES, time stepping, steps on disk."""
