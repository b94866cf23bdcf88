"""What a robot makes of the pictures: views unwarped from them."""
