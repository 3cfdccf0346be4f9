"""The online side: compensator, pilot, RSI link and the twin that closes the loop on predicted forces."""
