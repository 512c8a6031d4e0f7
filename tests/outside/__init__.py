"""Sets made from the contract alone.

Measurement folders of picture frames and cantilevered strips, made from seeds by forward models
that were written from the data contract and the mechanics only, without sight of the program that
is to diagnose them.  ``python -m outside.run FAMILY SEED`` makes, diagnoses and scores a family;
``python -m outside.table results.jsonl`` prints what came out.
"""
