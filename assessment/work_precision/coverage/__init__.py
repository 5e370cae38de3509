"""Does the stated error of an onset cover its true error?"""
