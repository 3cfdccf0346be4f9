"""What instruments and sound machines do by themselves: noise, short and slow, and normal mismatch."""
