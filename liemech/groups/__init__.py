"""Geometry: Lie groups, their algebras and their coadjoint actions."""
