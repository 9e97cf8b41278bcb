"""What goes over the wire to the microcontroller: frames, messages, and the text that defines them."""
