"""Before anything is imported: the tests and the commands that they start round alike."""

from fabric_fenicsx.processor import choose_kernels

choose_kernels()
