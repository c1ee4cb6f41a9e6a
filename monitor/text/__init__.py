"""Sentences, made from plain values. Nothing reads a sentence back."""
