"""Missions: what webs are for, as scenes that are shipped, beside published numbers and exact ones."""
