"""Hesai PandarXT-32: UDP packets to bursts and back."""
