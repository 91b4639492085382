"""What runs on a user's machine: numpy, SciPy and ONNX Runtime, never torch."""
