"""Recipes: short scripts to copy, each a whole job in Python.

    python -m validation.recipes.own_net [DIR]

and so on write into the folder DIR, by default the current one; each runs as a file as well, away from here.

========================= ================================================================================
``own_net``               a net with a thicker rim and corner masses, hit by a sphere; a folder and a picture
``gmsh_net``              a Gmsh file whose curves are groups and whose points are names, under load
``sweep``                 eight speeds of a ball, a table and a picture with error bars
``pandas_and_pyvista``    results as tables of pandas and as meshes of pyvista
``energies``              energies over time, and how far their sum drifts
``notebook.ipynb``        a scene, its results and pictures in Jupyter
========================= ================================================================================
"""
