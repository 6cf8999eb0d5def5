"""Between law and rotors: mixer, rotor model, lag, prediction over the delay, disturbances."""
