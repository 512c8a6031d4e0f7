"""Cantilevered strips."""
