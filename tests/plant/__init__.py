"""An independent simulation of the robot that writes measured runs; see README.md beside it."""
