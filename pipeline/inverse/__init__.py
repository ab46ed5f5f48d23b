"""The paper's inverse estimation: simulations on a grid, their Lagrange multinomial, Newton, intervals."""
