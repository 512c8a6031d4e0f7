"""Measured data as a user hands it over."""
