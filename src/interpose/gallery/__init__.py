"""The gallery of atomic trajectories (Chu and Yang 2024, DC-MoE, section 4 and appendix 9.1).

`tracks` holds the data, `windows` defines an atomic trajectory, `index` searches them, `matching` is Algorithm 1,
`paths` places what was found, `weighing` scores it, `proposals` chooses, `speeds` suggests durations, `store` saves.
"""
