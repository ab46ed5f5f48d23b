"""Material laws: elastic constants, cohesive laws, viscoelasticity."""
