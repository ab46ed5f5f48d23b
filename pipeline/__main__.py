"""`python -m pipeline` is the command `cohesive-bpm`."""

from pipeline.cli import main

if __name__ == "__main__":  # a spawned worker imports this file again
    main()
