"""Foundations without physics: errors, names, files, compiling, progress, the console."""
